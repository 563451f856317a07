"""What a user would have: cameras and their errors, pictures, and the truth beside them."""
