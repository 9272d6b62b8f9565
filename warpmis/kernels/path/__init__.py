"""Path tracing: the loop (li.py), what it carries along (state.py), and what happens at a vertex, an idea a file."""
