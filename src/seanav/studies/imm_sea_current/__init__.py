"""Paper 4: sea-current-relative navigation with an IMM of adaptive fading EKFs."""
