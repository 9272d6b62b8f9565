"""Shapes of a stage: meshes, curves, points, implicit shapes; refined, skinned, triangulated."""
