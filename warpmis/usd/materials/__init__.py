"""Materials of a stage: shading networks and their pictures, all end in one Material."""
