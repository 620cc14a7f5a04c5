"""Quality of a solution: errors against a reference, consistency with its own claims, the bound
of what is possible."""
