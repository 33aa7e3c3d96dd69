//! Datasets, losses, regularizers, optimisers hosted by argmin, the trainer.
