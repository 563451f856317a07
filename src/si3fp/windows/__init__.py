"""M.1: windows on orthographic images: detect, fuse over views, measure in metres."""
