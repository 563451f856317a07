"""What stands around the houses: placing, ground, trees, hedges, cars."""
