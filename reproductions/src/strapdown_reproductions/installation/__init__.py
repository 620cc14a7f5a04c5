"""The installation, estimated: what the states and the diagnosis find, against what was done."""
