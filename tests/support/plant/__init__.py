"""A model robot behind stand-ins of hardware: bridges and motors in, edges of encoders out."""
