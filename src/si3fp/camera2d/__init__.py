"""The Camera2D path: photos taken around a building."""
