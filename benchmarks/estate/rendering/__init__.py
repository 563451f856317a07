"""Light: paths, sun and sky, the denoiser."""
