"""Training of the networks of Phasefront: data, two stages, quantization, export, evaluation."""
