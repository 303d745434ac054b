"""File formats, one a file. What a file gets wrong comes out as one InputError, never a traceback.

Heavy libraries are imported where they are needed, so that reading a model file stays light.
"""
