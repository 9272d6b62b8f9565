"""Pictures on disk: EXR with everything that is known, PNG to look at."""
