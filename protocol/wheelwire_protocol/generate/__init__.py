"""Writes what is derived from the definitions: C++ header, Python types, MESSAGES.md, vectors."""
