"""Show results: tables, text, figures and pages, drawn from typed results; nothing is computed."""
