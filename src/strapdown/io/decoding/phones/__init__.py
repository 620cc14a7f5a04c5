"""Exports of phone apps: tables in a folder or zip, and assumptions on phones."""
