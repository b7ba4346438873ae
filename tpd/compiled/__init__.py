"""Compiled code of the exact model and of the nonlinear model: arcs, events, runs and orbits.

The exact model solves the linear equations (25) piece by piece in closed form. The nonlinear model integrates
equations (4) with Taylor series. Numba compiles both to machine code.

Three modules are the entry points for the rest of the package:

- `simulate.follow` simulates runs of both models, and `simulate.solve_steady` computes their steady states.
- `trajectories` returns states over time.
- `orbits` solves the symmetric periodic orbits.

Parameters are passed as rows of numbers (`rows`), in the order of `tpd.scene.parameters.NAMES`.

Two Newton methods solve for periodic orbits. Each has a compiled form for the exact model and a form in JAX
for the models that are JAX programs:

- The first method solves y = P(y), where P is the map over a number of forcing periods. It converges to
  orbits of any kind from a state nearby. See `period_map`, and `tpd.models.period_map` for JAX.
- The second method solves the map of half a forcing period of a symmetric orbit, with the numbers of the
  upper turning point as unknowns. `orbit_roots_kernel` does so in closed form and needs no initial state. See
  `tpd.models.half_period` for JAX.

The compiled functions use the same short names everywhere. A kernel is a function that Numba compiles.

- `q`: the plant, which holds the coefficients of the equations (`plant.PLANT`). It is complex where
  derivatives are computed.
- `m`: a motion, which holds state, contact mode and counters (`motion.MOTION`), or a mode alone. `m.y` is the
  state, `m.kind` is the kind of the contact, and `m.tilt` and `m.direction` are the signs of phi and phi'. In
  the kernels of symmetric orbits `m` holds the constants of a half period (`half_period_kernel.half`).
- `y`: a state (phi, psi, phi', psi').
- `x`: a row of parameters. In `arcs`, `events` and `march` it is a signal.
- `f`: the forcing of a run, piece by piece (`arcs.Forcing`). `i` is the index of a piece and `h` its
  duration. In the kernels of symmetric orbits `f` and `g` are flows over a time (`half_period_kernel.Flow`).
- `e`: the forcing from an instant on (`arcs.Load`). `q.e` in a plant is the velocity ratio of an impact.
- `s`: a row of settings (`custom_call.SETTINGS`). Next to `f` or `i` it is the time since the start of a
  piece.
- `w`: a workspace, that of the event search (`motion.WORKSPACE`) or of a Taylor series
  (`nonlinear_series.WORK`).
- `a`: the part of the workspace that the march uses (`motion.MARCH`). In the entry modules and in
  `custom_call` it holds addresses of buffers.
- `c`: coefficients, of the pieces of a forcing or of a series. In `period_map`, `near_orbits` and `steady` it
  is a cycle (`period_map.CYCLE`).
- `r`: the reader, which computes derivatives from legs (`legs.READER`). `by` holds derivatives.
- `out`: the record that a function fills.
- `t`: the time since the start of an arc. `tau`: the time since the start of a run.
- `eta`: minus the base acceleration over g, divided by its size f.
- `legs`: the legs of a motion (`motion.LEG`). A leg is the part of an arc from one event to the next.
"""
