"""Photoreal housing estates with exact truth: plans, meshes, renders and the files of a user."""
