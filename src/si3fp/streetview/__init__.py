"""Path S: street panoramas to registered views of each facade."""
