"""Design problem: search for a pendulum, validation of the result, and the job file."""
