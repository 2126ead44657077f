"""May a posterior be trusted: calibration, misfit, what an observation can tell, exact toys."""
