"""Houses as plans: the Million Programme by rule, and surveyed buildings from CityGML."""
