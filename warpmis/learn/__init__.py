"""Learning the allocation: the schedule of rounds and the solver kernels, one algorithm a file."""
