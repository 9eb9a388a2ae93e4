"""Physical effects a model may lack, one a file."""
