"""Everything that is compiled: closed-form arcs of (25), Taylor series of (4), events and orbits.

`runs.follow` is the one door to runs of both equations, and `runs.solve` to their steady states.
`trajectories` has states over time, and `orbits` the symmetric orbits. Parameters are rows (`rows`), in the
order of `tpd.scene.parameters.NAMES`.

Two Newton methods find periodic orbits, each with a compiled form for the exact model and one for models
that are programs of JAX:

- on the map P of some forcing periods, y = P(y): `period_map`, and `tpd.answers.period_map`. It finds orbits
  of any kind from a state near by.
- on the map of half a forcing period of symmetric orbits, in numbers of the upper turn: `orbit_roots_kernel`
  in closed form, from no state at all, and `tpd.models.half_period`.

Short names of the compiled functions, the same in all of them:

- `q`: the plant, which is the coefficients of the equations (`plant.PLANT`), complex for derivatives.
- `m`: a motion with its mode and its tally (`motion.MOTION`), or a mode alone: `m.y` is the state, `m.kind`
  the kind of the contact, `m.tilt` and `m.way` are the signs of phi and phi'. For symmetric orbits the
  numbers of a half period (`half_period_kernel.half`).
- `y`, `x`: a state (phi, psi, phi', psi'), and a row of parameters. In `arcs` and `events`, `x` is a signal.
- `f`: the forcing of a run, piece by piece (`arcs.Forcing`); `i` is a piece and `h` its duration. For
  symmetric orbits `f` and `g` are functions of time at an instant.
- `e`: the forcing from a moment on (`arcs.Load`). In a plant, `q.e` is the velocity ratio at impacts.
- `s`: a row of settings (`custom_call.SETTINGS`), or, beside `f` or `i`, the time since the start of a piece.
- `w`: working memory, of the search for events (`motion.ROOM`) or of a series (`nonlinear_series.WORK`).
- `c`: coefficients, of the pieces of a forcing or of a series; in `period_map`, `near_orbits` and `steady` a
  cycle (`period_map.CYCLE`).
- `r`: the reader of derivatives (`legs.READER`); `by` are derivatives, and `out` is the record to be filled.
- `t`, `tau`: times since the start of an arc, and since the start of a run. `a`: addresses of buffers.
"""
