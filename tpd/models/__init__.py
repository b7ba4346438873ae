"""Models of a block and a pendulum, one in each file, behind one interface."""
