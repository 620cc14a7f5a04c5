"""Parts that several readers of devices' files share."""
