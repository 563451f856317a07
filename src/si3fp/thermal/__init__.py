"""M.2: from buildings with windows to a thermal model (HBJSON) and its simulation."""
