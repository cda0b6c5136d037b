"""The kinds of systems, one file for each: parameters, coefficient matrices, impacts, and how they change."""
