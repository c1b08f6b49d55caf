"""One file per model: likelihood, parameters, and what is known of it without sampling."""
