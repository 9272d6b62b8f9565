"""The spatial cache, host half: vertex records of a round in, cells with what they have learned out."""
