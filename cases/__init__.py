"""Plants whose models lack something, one a file."""
