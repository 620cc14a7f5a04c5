"""Whether a finished solution can be trusted, and what of the installation is wrong."""
