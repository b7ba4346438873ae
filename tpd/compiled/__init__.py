"""Compiled code: one engine for runs of both equations, and the symmetric orbits of the linear model.

Taylor series (`series`) follow the linear equations (25) and the nonlinear equations (4) from event to event
(`follow`). The rules of the contact stand in `contact`. Numba compiles the code to machine code. Three
modules are the entry points for the rest of the package:

- `simulate.follow` simulates runs, and `simulate.solve_steady` computes their steady states.
- `trajectories` returns states over time.
- `orbits` solves the symmetric periodic orbits of (25) in closed form.

Parameters are passed as rows of numbers (`rows`), in the order of `tpd.scene.parameters.NAMES`.

Two Newton methods solve for periodic orbits. Each has a compiled form and a form in JAX for the models that
are JAX programs:

- The first method solves y = P(y), where P is the map over a number of forcing periods. It converges to
  orbits of any kind from a state nearby. See `period_map`, and `tpd.models.smoothed_orbit` for JAX.
- The second method solves the map of half a forcing period of a symmetric orbit, with the numbers of the
  upper turning point as unknowns. `orbit_roots_kernel` does so in closed form and needs no initial state. See
  `tpd.models.half_period` for JAX.

The compiled functions use the same short names everywhere:

- `q`: the plant, which holds the coefficients of the equations (`plant.PLANT`). It is complex where
  derivatives are computed. `q.e` is the velocity ratio of an impact.
- `m`: a motion, which holds state, contact mode and counters (`motion.MOTION`), or a mode alone. In the
  kernels of symmetric orbits it holds the constants of a half period (`half_period_kernel.half`).
- `y`: a state (phi, psi, phi', psi'). `x`: a row of parameters. `s`: a row of settings
  (`custom_call.SETTINGS`), or next to `f` and `i` the time since the start of a piece.
- `f`: the forcing of a run, piece by piece (`forcing.Forcing`). `i` is the index of a piece. In the kernels
  of symmetric orbits `f` and `g` are flows over a time (`half_period_kernel.Flow`).
- `e`: the forcing from an instant on (`forcing.Load`). `eta` is its value: minus the base acceleration over
  g, divided by its size f.
- `w`: the workspace of a run (`series.WORK`). `c`: its coefficients; in `period_map`, `near_orbits` and
  `steady` a cycle (`period_map.CYCLE`).
- `r`: the reader, which computes derivatives from `legs` (`legs.READER`, `motion.LEG`). `by` holds
  derivatives.
- `t`: the time since the start of a leg. `tau`: the time since the start of a run. `out`: the record that a
  function fills.
"""
