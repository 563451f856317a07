"""Houses as triangles."""
