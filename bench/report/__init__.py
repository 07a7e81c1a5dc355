"""Tables, text, figures and pages of typed results."""
