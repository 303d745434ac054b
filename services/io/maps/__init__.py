"""Elevation maps in files: GeoTIFF, npz, grid maps."""
