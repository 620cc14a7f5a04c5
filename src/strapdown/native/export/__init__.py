"""A filter as an object, a C header and an example, for firmware and other languages."""
