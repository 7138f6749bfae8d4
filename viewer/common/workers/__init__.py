"""Tasks spread over several processes of this machine, or over the workers of a Dask scheduler.

``run_tasks`` is the one function that commands call.  ``worker_process`` starts a process and gives it tasks, ``worker_main``
is what runs in it, ``messages`` the language between both, ``local_tasks`` and ``dask_tasks`` are the two ways to spread tasks.
"""
