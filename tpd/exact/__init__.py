"""The exact piecewise solution: closed-form arcs, events between them, and the orbits they make."""
