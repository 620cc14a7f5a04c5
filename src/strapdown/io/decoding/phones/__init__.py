"""Exports of phones' apps: tables in a folder or zip, and what is assumed of a phone."""
