"""The story of a render: scene in, rounds of trace and learn, result out."""
