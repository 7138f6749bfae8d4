"""Select: points by a lasso, a box, a plane or what hangs together; classes and regions."""
