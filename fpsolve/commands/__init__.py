"""The commands of `fpsolve`, a file for each, and the options that they share."""
