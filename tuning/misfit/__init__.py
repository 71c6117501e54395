"""The misfit that tuning minimises, with its exact derivatives."""
