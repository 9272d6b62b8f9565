"""Device code alone: wp.func, wp.kernel and their factories. No NumPy, no input or output."""
