"""Training of the window detector: data, augmentation, network, losses, measuring and export."""
