"""Surface scattering: UsdPreviewSurface as a diffuse lobe under up to two GGX lobes."""
