"""Finding the effect: data in, model beside it, discrepancy, effect, corrected model."""
