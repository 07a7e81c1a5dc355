"""Front end that all algorithms share: prediction, decision, search; it imports no algorithm."""
