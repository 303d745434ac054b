"""File formats, one per module. Every fault of a file is one InputError, never a traceback.

Heavy libraries are imported where they are needed, so that reading a model file stays light.
"""
