"""Synthetic facades with exact truth for the radiance field: scene, renderer, scores, command."""
