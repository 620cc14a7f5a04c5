"""Parts of formats that several readers share."""
