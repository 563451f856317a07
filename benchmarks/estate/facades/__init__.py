"""Facade pictures with exact boxes: training data for the detector."""
