"""What an estimator does: filters, matchers and planners; arrays in, arrays out."""
