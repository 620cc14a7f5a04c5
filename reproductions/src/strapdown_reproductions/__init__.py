"""Reproductions of published and recorded results; each writes index.html, CSV tables and
claims.json."""
