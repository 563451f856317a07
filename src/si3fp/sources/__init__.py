"""Step S.1: panoramas, plane maps and footprints from files and services become domain types."""
