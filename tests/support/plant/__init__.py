"""A model robot behind stand-ins for hardware: bridges and motors in, encoder edges out."""
