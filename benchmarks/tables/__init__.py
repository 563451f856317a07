"""The paper's tables for rendered buildings of the same kind, beside the paper's own figures."""
