"""Lights: one file a kind, each with a sampler and the hit that tells the sampler's density."""
