"""A run from its settings to its report: the only place that joins both wings."""
