"""Frames, cameras, planes and grids; numpy only."""
