"""Albedo: whole walls, the ground, materials and textures."""
