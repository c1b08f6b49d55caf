"""Posteriors: models, sampling with emcee, diagnostics, calibration of the posteriors."""
